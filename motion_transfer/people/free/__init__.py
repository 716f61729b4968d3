"""Free people: photographed skins, clothes and hair of MakeHuman's on the project's own body."""
