"""FBX: written as nodes of a binary file, read as the glTF document that says the same."""
