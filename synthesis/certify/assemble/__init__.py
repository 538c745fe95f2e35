"""The inequalities as cone programs: the fast assembly for one parameter, the general one."""
