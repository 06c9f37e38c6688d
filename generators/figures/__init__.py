"""What the supplement of Guo et al. 2019 shows, made anew: one file per figure, and the gallery that holds them."""
