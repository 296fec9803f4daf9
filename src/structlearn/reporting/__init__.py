"""Reports: figures, tables and the pages that show them."""
