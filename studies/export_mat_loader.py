"""MATLAB functions that rebuild the exported family: `ss` array and `lpvss` model with names, units
and trim offsets.
"""

from __future__ import annotations

LOADER = """function [models, lpv, family] = load_symheli(file)
%LOAD_SYMHELI  Helicopter models along airspeed, written by "symheli export mat".
%   models = LOAD_SYMHELI(file) is an array of ss models, one an airspeed, about the trims family.x0(:,k), family.u0(:,k):
%   names and units of states, inputs and outputs, airspeeds (m/s) in SamplingGrid. Control System Toolbox.
%   [models, lpv] = LOAD_SYMHELI(file) also gives an lpvss model (R2023a and later) with the parameter airspeed, whose
%   matrices and trim offsets run straight between the airspeeds and stay constant outside them. Its states, inputs and outputs are
%   total values: start it at a trim, for example  [~,~,~,~,~,~,x0,u0] = symheli_at(family, 5).
%   [models, lpv, family] = LOAD_SYMHELI(file) gives the contents of the file too. LPVTools:
%   pss(models, rgrid('airspeed', family.airspeeds(:)')).
%   SI units and radians, body axes x forward, y right, z down.
    family = load(file);
    names = {'StateName', family.states(:), 'InputName', family.inputs(:), 'OutputName', family.outputs(:), ...
             'InputUnit', family.inputs_units(:), 'OutputUnit', family.outputs_units(:)};
    models = ss(family.A, family.B, family.C, family.D, names{:}, 'StateUnit', family.states_units(:), 'Name', family.title);
    models.SamplingGrid = struct('airspeed', family.airspeeds(:));
    if nargout > 1
        data = @(t, p) symheli_at(family, p);
        lpv = lpvss('airspeed', data, 0, 0, family.airspeeds(1));
        lpv.StateName = family.states(:);
        lpv.InputName = family.inputs(:);
        lpv.OutputName = family.outputs(:);
    end
end
"""
"""load_symheli.m: what a user calls."""

DATA_FUNCTION = """function [A, B, C, D, E, dx0, x0, u0, y0, delays] = symheli_at(family, airspeed)
%SYMHELI_AT  Data function for lpvss: matrices and trim offsets of a family (see load_symheli) at an airspeed in m/s.
%   dx/dt = dx0 + A (x - x0) + B (u - u0),  y = y0 + C (x - x0) + D (u - u0)
    p = min(max(airspeed, family.airspeeds(1)), family.airspeeds(end));
    at = @(values) interpolate(family.airspeeds(:), values, p);
    A = at(family.A);
    B = at(family.B);
    C = at(family.C);
    D = at(family.D);
    x0 = at(reshape(family.x0, size(family.x0, 1), 1, []));
    u0 = at(reshape(family.u0, size(family.u0, 1), 1, []));
    y0 = at(reshape(family.y0, size(family.y0, 1), 1, []));
    dx0 = zeros(size(x0));
    E = [];
    delays = [];
end

function M = interpolate(airspeeds, values, p)
% straight between the pages of values (n, m, K)
    n = size(values, 1);
    m = size(values, 2);
    M = reshape(interp1(airspeeds, reshape(values, n * m, []).', p), n, m);
end
"""
"""symheli_at.m: the data function of the lpvss model."""
