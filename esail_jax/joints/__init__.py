"""How tethers are held: roots on a hub or in a turning frame."""
