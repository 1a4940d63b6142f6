"""The commands of `esail`, one module each."""
