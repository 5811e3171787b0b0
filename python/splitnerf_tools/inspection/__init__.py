"""What ``splitnerf inspect`` finds in a data set: what it holds, and what may be wrong with it."""
