"""Compare the files of the pipeline with what its stages wrote: `python -m structlearn.verify [FILE ...]`.

Without arguments, every output listed in a `dvc.lock` is read and its digest compared; DVC itself checks
times and sizes first, so it does not detect bit rot. With arguments, the checksums of single files are
checked (arrays, skills, tables, bags). The exit code is 1 if a file differs from what was written.
"""

import argparse
import hashlib
import json
import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from structlearn.core.artefacts import read_description, read_metrics, read_table, read_tensors
from structlearn.core.errors import InputError
from structlearn.core.params import read_values
from structlearn.core.used_files import digest as file_digest
from structlearn.readers.raw_messages import read_bag

SKILL = '{"reactive_skill"'  # start of a skill file's description


def main() -> None:
    """Print which files differ from what was written; exit with code 1 if any do."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("files", nargs="*", type=Path, help="default: all outputs of all stages")
    files = parser.parse_args().files
    locks = [*Path().glob("dvc.lock"), *sorted(Path().glob("stages/*/dvc.lock"))]
    if not (files or locks):
        sys.exit("error: dvc.lock: no such file; run this in the project's folder, after the pipeline")
    faults, unsigned = [], [file for file in files if file.suffix == ".json"]
    try:
        faults += [_fault(file) for file in files]
        for lock in () if files else locks:
            written = outputs(lock)
            parts = {output.part for output in written}
            here = {output.part for output in written if _is_made_here(output)}
            faults += output_faults(output for output in written if output.part in here)
            if some := len(parts - here):
                which = f"{some} of its {len(parts)} tasks or cells have" if here else "has"
                print(f"{lock.with_name('dvc.yaml')}: {which} not been run here")
    except InputError as error:
        sys.exit(f"error: {error}")
    if any(faults):
        sys.exit("\n".join(f"error: {fault}" for fault in faults if fault))
    for file in unsigned:
        print(f"{file}: can be read; it carries no checksum that says whether it is as it was written")
    if count := len(faults) - len(unsigned):
        print(f"{count} {'files' if files else 'outputs'}: all are as they were written")


class Output(NamedTuple):
    """An output listed in a `dvc.lock`."""

    stage: str
    path: Path
    digest: str

    @property
    def part(self) -> str:
        """Task or cell that the stage runs for, which can be run without the others; empty if none."""
        return self.stage.partition("@")[2]


def outputs(lock: Path, root: Path = Path()) -> list[Output]:
    """All outputs listed in a lock, with paths below `root`. Raises InputError if it is unreadable."""
    try:
        stages = read_values(lock)["stages"].items()
        return [
            Output(name, root / out["path"], out["md5"])
            for name, stage in stages
            for out in stage.get("outs", ())
        ]
    except (AttributeError, KeyError, TypeError) as error:  # missing or misplaced entries
        raise InputError(f"{lock}: not a lock file of DVC: {type(error).__name__}: {error}") from error


def _is_made_here(output: Output) -> bool:
    """Whether the output exists and was made here, unlike reports, which are in git."""
    return output.path.parts[:1] != ("reports",) and output.path.exists()


def output_faults(outputs: Iterable[Output]) -> Iterator[str | None]:
    """Fault of each output that differs from what was written; None for intact ones."""
    for name, path, written in outputs:
        try:
            yield None if dvc_digest(path) == written else f"{path}: not as stage '{name}' left it"
        except FileNotFoundError:
            yield f"{path}: is not there; stage '{name}' writes it"
        except (OSError, ValueError) as error:  # ValueError: null byte in the path
            yield f"{path}: cannot be read: {error}"


def dvc_digest(path: Path) -> str:
    """MD5 of a file, or of the JSON list of a folder's files with their MD5, as in DVC."""
    if not path.is_dir():
        return file_digest(path, "md5")
    files = sorted((file.relative_to(path).as_posix(), file) for file in path.rglob("*") if file.is_file())
    listing = [{"md5": dvc_digest(file), "relpath": name} for name, file in files]
    return hashlib.md5(json.dumps(listing, sort_keys=True).encode()).hexdigest() + ".dir"


def _fault(path: Path) -> str | None:
    """Fault of a file that differs from what was written; None if it is intact."""
    if path.suffix not in READERS:
        return f"{path}: only {', '.join(READERS)} can be told"
    try:
        READERS[path.suffix](path)
    except InputError as error:
        return str(error)
    return None


def _read_arrays(path: Path) -> object:
    """Read arrays; a skill must be complete as well."""
    if not read_description(path).startswith(SKILL):
        return read_tensors(path)
    from structlearn.feedback.skill_file import read_skill  # slow: imports compiled code

    return read_skill(path)


READERS: dict[str, Callable[[Path], object]] = {
    ".safetensors": _read_arrays,
    ".parquet": read_table,
    ".json": read_metrics,
    ".mcap": lambda path: read_bag(path, ()),
}

if __name__ == "__main__":
    main()
