def draw(out): pass
