"""What MCSG is compared with, one file a method or ablation, all on one problem and one budget of simulator calls."""
