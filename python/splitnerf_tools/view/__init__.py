"""The viewer: a small web server that shows assets in the browser, and the page that it serves."""
