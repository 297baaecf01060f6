"""`bubbleskin bring-up`: a board that has never run, step by step, and only after each yes.

`evidence` is what was seen, `wires` and `verdicts` say what it means, `report` writes it down; none of these touches a board.
`session` moves one, `person` stands in for whoever sits before a simulated one.
"""
