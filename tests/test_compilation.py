import os

from structlearn.core import compilation


def write(folder, name, text):
    (folder / name).parent.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text(text)


def test_an_edit_of_any_compiled_source_gives_another_folder(tmp_path):
    write(tmp_path, "caller.py", "import numba\n")
    write(tmp_path, "rooms/callee.py", "import numba\nx = 1\n")
    before = compilation.sources_digest(tmp_path)
    write(tmp_path, "rooms/callee.py", "import numba\nx = 2\n")
    assert compilation.sources_digest(tmp_path) != before
    write(tmp_path, "rooms/callee.py", "import numba\nx = 1\n")
    write(tmp_path, "page.py", "text = 'it compiles nothing'\n")
    assert compilation.sources_digest(tmp_path) == before


def test_a_folder_that_the_user_chose_stays(tmp_path, monkeypatch):
    monkeypatch.setenv(compilation.VARIABLE, "/somewhere")
    compilation.use_own_cache(tmp_path)
    assert os.environ[compilation.VARIABLE] == "/somewhere"
    monkeypatch.delenv(compilation.VARIABLE)
    compilation.use_own_cache(tmp_path)
    assert os.environ[compilation.VARIABLE].startswith(str(tmp_path / "__pycache__" / "compiled-"))


def test_the_package_uses_it():
    import numba

    import structlearn

    assert os.environ[compilation.VARIABLE] == numba.config.CACHE_DIR
    assert structlearn.__version__
