from synthesis.sheet.sheet import Sheet as Sheet
