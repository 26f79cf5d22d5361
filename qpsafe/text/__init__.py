"""Words, JSON and TOML."""
