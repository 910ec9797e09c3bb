"""Writing catalogues: the folder, its index and what each scenario says about itself."""
