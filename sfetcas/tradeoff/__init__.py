"""Work-precision measurement: error against time for the discretisations of one scene."""
