"""How the pages of this folder become a site, `make docs`: nothing is fetched, now or when read."""

project = "foretwin"
project_copyright = "the foretwin authors; maps © OpenStreetMap contributors"
extensions = ["myst_parser"]
myst_heading_anchors = 4
html_theme = "furo"
html_title = "foretwin"
html_theme_options = {"footer_icons": []}
html_show_sourcelink = False
