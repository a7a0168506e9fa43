"""Readers of what trainers leave behind. They read data and never run what a file holds."""
