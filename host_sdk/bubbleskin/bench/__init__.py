"""What `bubbleskin bench` measures. Speeds are ratios to something measured in the same run, wherever one fits."""
