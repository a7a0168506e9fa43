"""One module for each family of models: its arrays, and its graph."""
