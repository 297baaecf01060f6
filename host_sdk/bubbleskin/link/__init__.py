"""The host's end of the wire: bytes, requests and replies."""
