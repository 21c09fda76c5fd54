"""The sculptor: models the mannequin by code; needs scipy. `tools/build_mannequin.py` keeps what it makes."""
