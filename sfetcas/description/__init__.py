"""The description of a scene: frozen records, validated at construction, and the files that they are read from."""
