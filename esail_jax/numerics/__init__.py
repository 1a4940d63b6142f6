"""Mathematics without physics: structured solves, loops for `vmap`, derivative rules, vectors."""
