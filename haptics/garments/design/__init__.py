"""Where to reinforce a garment: evolution, hand-drawn designs, masks, ratings, the store."""
