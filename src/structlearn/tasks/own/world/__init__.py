"""The example task, made up so that the pipeline can be tried before there are bags."""
