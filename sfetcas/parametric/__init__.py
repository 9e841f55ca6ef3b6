"""Numbers of a scene as parameters: equilibria and motions as functions of them, with exact derivatives."""
