"""From sensor counts to open times: estimate, trajectory and dose of every bubble, and the air supply."""
