"""Tables of skeletons: names, parents, offsets. No logic lives here."""
