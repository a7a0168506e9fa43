"""Readers of the files of trainers. They read data and never execute code of a file."""
