"""Methods of time integration."""
