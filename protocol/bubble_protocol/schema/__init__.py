"""The protocol as plain data, a namespace each: messages and their fields, and what the numbers in them mean."""
