"""Numbers of a scene as parameters: how its data depend on them, its equilibria and motions as functions of them."""
