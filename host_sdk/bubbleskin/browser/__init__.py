"""The array as browsers draw it, for the studio's page and for notebooks: what it is told, what draws it, the live widget."""
