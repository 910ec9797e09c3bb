"""Maps in any format as lanes: converted, compared, cut, drawn; the command `xosc-road`."""
