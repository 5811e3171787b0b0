"""What ``splitnerf doctor`` looks at: the machine, the installation, and every operator against a closed form."""
