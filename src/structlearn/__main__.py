"""The command `structlearn`; without the extra `learn`, as on a robot's computer, it says what to install."""

import re
import sys
from importlib.metadata import PackageNotFoundError, requires, version

from structlearn.core.processor import pin

EXTRA = "learn"


def main() -> None:
    """Run the command, or print one line and exit with code 1."""
    try:
        for requirement in requires("structlearn") or ():
            if re.search(f"extra == .{EXTRA}", requirement):
                version(re.split(r"[^\w.-]", requirement)[0])
    except PackageNotFoundError:
        called = " ".join(["structlearn", *sys.argv[1:2]])
        sys.exit(f"error: {called} needs the extra `{EXTRA}`: pip install 'structlearn[{EXTRA}]'")
    pin()
    from structlearn import command  # loads much of what the extra has

    command.main()


if __name__ == "__main__":
    main()
