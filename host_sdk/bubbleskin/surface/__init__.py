"""The surface: tops of bubbles that touch, kept from what was sent and told, asked for, and held within limits."""
