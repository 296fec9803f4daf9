from viewer_files import contents, view_names  # noqa: F401 (until all tests of recordings read viewer_files)
