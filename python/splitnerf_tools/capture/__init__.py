"""From photographs to the posed, masked images that training reads."""
