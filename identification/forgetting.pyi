from identification.recursive.forgetting import Constant as Constant
from identification.recursive.forgetting import Directional as Directional
from identification.recursive.forgetting import Forgetting as Forgetting
from identification.recursive.forgetting import Variable as Variable
