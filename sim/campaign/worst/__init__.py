"""The worst encounter of a controller: a search in the cube of the people's model, and its cases as files."""
