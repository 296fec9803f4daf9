"""Publish the index page of all public sets."""

from structlearn.core.stage import run
from structlearn.tasks.recorded_index import publish_index

if __name__ == "__main__":
    run(publish_index)
