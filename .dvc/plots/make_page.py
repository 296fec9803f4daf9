"""Write `.dvc/plots.html`: the page of `dvc plots show` with Vega inside, so that it needs no network."""

from pathlib import Path

import vl_convert

PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>Plots</title>{refresh_tag}<script>%s</script></head>
<body>{plot_divs}</body></html>
"""

script = vl_convert.javascript_bundle().replace("</script", "<\\/script")
Path(__file__).parents[1].joinpath("plots.html").write_text(PAGE % script, encoding="utf-8")
