"""Characters: nodes with skins and animations, as in files, and the skeletons and motions made of them."""
