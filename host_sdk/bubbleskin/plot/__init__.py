"""Pictures of membranes, shapes and moves."""
