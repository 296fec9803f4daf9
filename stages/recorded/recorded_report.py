"""Page that lists all public sets."""

from dissertation.recorded.recorded_index import publish_index
from structlearn.core.stage import run

if __name__ == "__main__":
    run(publish_index)
