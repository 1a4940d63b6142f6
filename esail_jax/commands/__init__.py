"""The commands of `esail`: run, ensemble, design and bench, and what they share."""
