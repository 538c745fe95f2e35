function [models, lpv, family] = load_symheli(file)
%LOAD_SYMHELI  Helicopter models along airspeed, written by "symheli export mat".
%   models = LOAD_SYMHELI(file) is an array of ss models, one an airspeed, about the trims
%   family.x0(:,k), family.u0(:,k): names and units of states, inputs and outputs, airspeeds (m/s)
%   in SamplingGrid. Control System Toolbox.
%   [models, lpv] = LOAD_SYMHELI(file) also gives an lpvss model (R2023a and later) with the
%   parameter airspeed, whose matrices and trim offsets run straight between the airspeeds and stay
%   constant outside them. Its states, inputs and outputs are total values: start it at a trim, for
%   example  [~,~,~,~,~,~,x0,u0] = symheli_at(family, 5).
%   [models, lpv, family] = LOAD_SYMHELI(file) gives the contents of the file too. LPVTools:
%   pss(models, rgrid('airspeed', family.airspeeds(:)')).
%   SI units and radians, body axes x forward, y right, z down.
    family = load(file);
    names = {'StateName', family.states(:), 'StateUnit', family.states_units(:), ...
             'InputName', family.inputs(:), 'InputUnit', family.inputs_units(:), ...
             'OutputName', family.outputs(:), 'OutputUnit', family.outputs_units(:), ...
             'Name', family.title};
    models = ss(family.A, family.B, family.C, family.D, names{:});
    models.SamplingGrid = struct('airspeed', family.airspeeds(:));
    if nargout > 1
        data = @(t, p) symheli_at(family, p);
        lpv = lpvss('airspeed', data, 0, 0, family.airspeeds(1));
        lpv.StateName = family.states(:);
        lpv.InputName = family.inputs(:);
        lpv.OutputName = family.outputs(:);
    end
end
