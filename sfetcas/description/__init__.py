"""What the user says, validated at construction: frozen records, each with its rules, and the files they come from."""
