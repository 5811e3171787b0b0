"""The layouts of posed image sets, one module each.

Each has
    present(root)        whether a folder has this layout
    splits(root)         the names of the splits that the data themselves make, or None where they make none
    read(root, split)    the frames of one of these splits, or with None all frames, each once
and raises InputError with one line where a file cannot be used.
"""
