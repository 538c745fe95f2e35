from symheli.export.board import write_board as write_board
from symheli.export.c import write_c as write_c
from symheli.export.controller import write_controller as write_controller
from symheli.export.flying_fmus import write_controller_fmu as write_controller_fmu
from symheli.export.flying_fmus import write_helicopter_fmu as write_helicopter_fmu
from symheli.export.mat import write_family_mat as write_family_mat
from symheli.export.mat import write_mat as write_mat
from symheli.export.monitor import write_monitor as write_monitor
