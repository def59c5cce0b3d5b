"""Characters: nodes with skins and animations, as files hold them, and the skeletons and motions that they are."""
