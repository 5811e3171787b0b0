"""Images, posed datasets and the truth that may come with them."""
