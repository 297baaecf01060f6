"""Shapes: from what a user means to one height per bubble."""
