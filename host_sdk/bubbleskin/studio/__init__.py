"""The page of `bubbleskin studio`: a wristband live in a browser, and played from there. Needs the extra `bubbleskin[studio]`."""
