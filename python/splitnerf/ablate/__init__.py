"""What each part of the method is worth: one run per part, with it taken out or exchanged."""
