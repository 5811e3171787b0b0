"""Many scenes: a training for each, on one machine or on a cluster, and one table of their results.

Ray gives each scene its share of a machine (:mod:`splitnerf_tools.batch.cluster`); a process of its own trains it there
(:mod:`splitnerf_tools.batch.child`); the program that was called watches them and writes the table
(:mod:`splitnerf_tools.batch.tasks`).
"""
