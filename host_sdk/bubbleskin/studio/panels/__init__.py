"""The panels beside the array, a module each."""
