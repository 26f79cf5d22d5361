"""What `make docs` adds to the pages in Markdown: API reference and commands, made from the code itself."""
