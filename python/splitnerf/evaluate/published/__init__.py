"""The protocols by which published data sets are scored."""
