"""One module for each family of models: what it reads, and the graph it writes."""
