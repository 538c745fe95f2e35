from synthesis.tubes.coverage import Coverage as Coverage
from synthesis.tubes.coverage import coverage as coverage
from synthesis.tubes.gain import LocalGain as LocalGain
from synthesis.tubes.largest_gust import LargestGust as LargestGust
from synthesis.tubes.largest_gust import largest_gust as largest_gust
from synthesis.tubes.motions import Motions as Motions
from synthesis.tubes.tube import Tube as Tube
from synthesis.tubes.tube import tube as tube
