"""The protocols by which published data sets are scored, one module each.

Each has
    LAYOUT                          the layout that it reads, a module of :mod:`splitnerf.data.layouts`
    COLUMNS                         key, title and format of each number of its table, the headline first
    score(delivered, root, options) the numbers, :class:`splitnerf.evaluate.published.common.Scores`
and raises InputError with one line where the data do not hold what it needs. `numbers.json` holds what was published.
"""
